"""Documents and files with something wrong in them, drawn from a seed."""

import copy
import random
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

DEEP: Any = []
for _ in range(60):
    DEEP = [DEEP]

ODD: tuple[Any, ...] = (
    *(None, True, False, 0, 1, -1, 7, 0.5, -0.0, 1e-300, 1e300, -1e300, 2**31, 2**63, 10**30),
    *(float("nan"), float("inf"), float("-inf")),
    *(
        "",
        " ",
        "x",
        "axis1_a",
        "null",
        "2021-13-45",
        "1e5",
        "é",
        "\x00",
        "a\nb",
        "../..",
        "x" * 5000,
    ),
    *([], {}, [[]], [1, "a", None], {"a": {"b": 1}}, {"": ""}, DEEP),
)
"""Values in the place of others."""

ODD_YAML = (
    *("!!int foo", "!!float bar", "!!timestamp x", "2021-13-45", "1:99:99", "0o17", "0x", "0b2"),
    *("9" * 5000, "-" + "9" * 350, "1e999", ".nan", "-.inf", "?", "- -", "[", "{a: ", "*nowhere"),
    *(
        "&a [*a]",
        "[" * 500,
        "{a: " * 200,
        "{[1]: 2}",
        "{{a: 1}: 2}",
        "!!python/object/apply:os.abort []",
    ),
    *(
        '"\\ud800"',
        '"\\x00"',
        "<<: 1",
        "{<<: {a: 1}}",
        "!!binary x",
        "!!set {a}",
        "!custom 1",
        "%x",
    ),
    "[&a [1,1,1,1,1,1,1,1,1,1],&b [*a,*a,*a,*a,*a,*a,*a,*a,*a],&c [*b,*b,*b,*b,*b,*b,*b,*b],"
    "&d [*c,*c,*c,*c,*c,*c,*c,*c],&e [*d,*d,*d,*d,*d,*d],[*e,*e,*e,*e,*e,*e]]",
)
"""YAML in the place of values."""


def places(tree: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the paths of every value in a tree of mappings and lists."""
    found = [path]
    if isinstance(tree, dict):
        for key, value in tree.items():
            found += places(value, (*path, key))
    elif isinstance(tree, list):
        for index, value in enumerate(tree[:20]):
            found += places(value, (*path, index))
    return found


def mutated(tree: Any, rng: random.Random, odd: tuple[Any, ...] = ODD) -> Any:
    """Replace, remove, add or rename some values."""
    tree = copy.deepcopy(tree)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        path = rng.choice(places(tree)[1:] or [()])
        other = copy.deepcopy(rng.choice(odd))
        if not path:
            return other
        owner = tree
        for part in path[:-1]:
            owner = owner[part]
        match rng.randrange(6):
            case 0 if isinstance(owner, dict):
                del owner[path[-1]]
            case 1 if isinstance(owner, dict):
                owner[f"{path[-1]}x"] = owner.pop(path[-1])
            case 2 if isinstance(owner, dict):
                owner[rng.choice(("x", "", "axis0_a", "axis9999999999_a", "é" * 50))] = other
            case 3 if isinstance(owner, list):
                owner.append(copy.deepcopy(owner[path[-1]]))
            case _:
                owner[path[-1]] = other
    return tree


def damaged(content: bytes, rng: random.Random) -> bytes:
    """Flip, cut, repeat or insert bytes."""
    data = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 8))):
        if not data:
            break
        at = rng.randrange(len(data))
        # the footer of a Parquet file is short and holds all that is believed of it
        if rng.random() < 0.5:
            at = max(len(data) - 1 - rng.randrange(min(len(data), 4000)), 0)
        match rng.randrange(6):
            case 0:
                del data[at:]
            case 1:
                data[at:at] = bytes(rng.randrange(256) for _ in range(rng.randrange(1, 20)))
            case 2:
                del data[at : at + rng.randrange(1, 100)]
            case 3:
                data[at : at + 4] = rng.choice((b"\xff" * 4, b"\x00" * 4, b"\x7f\xff\xff\xff"))
            case _:
                data[at] ^= 1 << rng.randrange(8)
    return bytes(data)


ODD_CELLS: tuple[Any, ...] = (
    None,
    float("nan"),
    float("inf"),
    0,
    -1,
    1,
    2**31 - 1,
    -(2**31),
    1e300,
)


def table_mutated(source: Path, to: Path, rng: random.Random, keep_metadata: bool = True) -> None:
    """Write a table with cells, columns or types changed."""
    table = pq.read_table(source)
    for _ in range(rng.choice((1, 1, 2, 3))):
        index = rng.randrange(table.num_columns)
        field, column = table.schema.field(index), table.column(index)
        match rng.randrange(8):
            case 0:
                table = table.remove_column(index)
            case 1:
                table = table.append_column(field, column)
            case 2:
                names = list(table.column_names)
                names[index] = rng.choice(("", "x", "axis0_a", "axis99999_a", "time_s", "é"))
                table = table.rename_columns(names)
            case 3:
                other = rng.choice((pa.float64(), pa.string(), pa.int8(), pa.bool_(), pa.binary()))
                try:
                    table = table.set_column(index, field.name, column.cast(other, safe=False))
                except pa.ArrowException:
                    continue
            case 4:
                table = table.slice(rng.randrange(table.num_rows + 1), rng.randrange(3) * 100)
            case 5:
                table = pa.concat_tables([table, table.slice(0, 1 + table.num_rows // 2)])
            case _:
                values = column.to_pylist()
                if not values:
                    continue
                for row in rng.sample(
                    range(len(values)), min(len(values), rng.choice((1, 5, 100)))
                ):
                    if pa.types.is_list(field.type):
                        values[row] = rng.choice(([], [-1], [1e300], values[row][:3], None))
                    elif pa.types.is_string(field.type):
                        values[row] = rng.choice(("", "x" * 1000, "\x00", None, "../x"))
                    else:
                        values[row] = rng.choice(ODD_CELLS)
                try:
                    array = pa.array(values, field.type)
                except (pa.ArrowException, OverflowError, TypeError, ValueError):
                    continue
                table = table.set_column(index, field, array)
        if table.num_columns == 0:
            break
    metadata = pq.read_schema(source).metadata if keep_metadata else {}
    pq.write_table(table.replace_schema_metadata(metadata), to, write_page_checksum=True)

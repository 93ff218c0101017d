"""Size and decoding speed of a run's samples under the encodings that Parquet offers.

python benchmarks/chain/encoding.py

The reason for the one that `opamc_cli.storage.runs.writing` uses. Times are processor seconds of
one thread, the best of five.
"""

import argparse
import tempfile
import time
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from opamc_cli.storage.runs.writing import ROW_GROUP_SAMPLES

SAMPLE = Path(__file__).parents[2] / "data" / "samples" / "normal" / "session-000.parquet"

ENCODINGS = {
    "dictionary, lz4": {"use_dictionary": True, "compression": "lz4"},
    "dictionary, zstd": {"use_dictionary": True, "compression": "zstd"},
    "dictionary": {"use_dictionary": True, "compression": "none"},
    "split bytes, zstd": {
        "use_dictionary": False,
        "use_byte_stream_split": True,
        "compression": "zstd",
        "compression_level": 1,
    },
    "split bytes, lz4": {
        "use_dictionary": False,
        "use_byte_stream_split": True,
        "compression": "lz4",
    },
    "plain, snappy": {"use_dictionary": False, "compression": "snappy"},
    "plain": {"use_dictionary": False, "compression": "none"},
}


def decode_s(path: Path) -> float:
    start = time.process_time()
    with pq.ParquetFile(path, page_checksum_verification=True) as file:
        for group in range(file.num_row_groups):
            file.read_row_group(group, use_threads=False)
    return time.process_time() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, nargs="?", default=SAMPLE)
    parser.add_argument("--repeat", type=int, default=8, help="Length, in copies of the run.")
    arguments = parser.parse_args()
    table = pa.concat_tables([pq.read_table(arguments.run)] * arguments.repeat)
    samples = table.num_rows * table.num_columns
    print(f"{'encoding':<20} {'MB':>7} {'bits/sample':>12} {'M samples/s':>12}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.parquet"
        for name, options in ENCODINGS.items():
            pq.write_table(
                table, path, row_group_size=ROW_GROUP_SAMPLES, write_page_checksum=True, **options
            )
            size = path.stat().st_size
            best = min(decode_s(path) for _ in range(5))
            print(
                f"{name:<20} {size / 1e6:>7.1f} {8 * size / samples:>12.1f} "
                f"{samples / best / 1e6:>12.0f}"
            )


if __name__ == "__main__":
    main()

"""Joint states of which some messages leave fields out."""

from pathlib import Path
from types import SimpleNamespace as Message

from opamc_cli.storage.ingest.readers.ros import RosSource, _Topic


def test_a_field_is_listed_that_one_message_holds():
    topic = _Topic()
    for velocity in ([], [0.5, 0.6]):
        stamp = Message(sec=1, nanosec=0)
        header = Message(stamp=stamp)
        names, effort = ["hip", "knee"], []
        fields = {"position": [1.0, 2.0], "velocity": velocity, "effort": effort}
        topic.add(Message(header=header, name=names, **fields), 0)
    topic.done()
    source = RosSource(Path("r.bag"), {"/js": topic})
    assert [(str(c.name), c.unit, c.width) for c in source.channels()] == [
        ("/js/stamp", "s", None),
        ("/js/hip/position", "rad", None),
        ("/js/knee/position", "rad", None),
        ("/js/hip/velocity", None, None),
        ("/js/knee/velocity", None, None),
        ("position", None, 2),
        ("velocity", None, 2),
    ]

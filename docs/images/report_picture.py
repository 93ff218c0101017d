"""Draw the README's picture: `python docs/images/report_picture.py OUT docs/images/report.png`."""

import argparse
from pathlib import Path

from opamc_cli.stages.report.figures.jsd_scatter import picture
from opamc_cli.stages.report.inputs import read_inputs

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="output folder of opamc diagnose")
    parser.add_argument("png", type=Path, help="where the picture goes")
    options = parser.parse_args()
    options.png.write_bytes(picture(read_inputs(options.out, {})))

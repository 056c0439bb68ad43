"""Every table and picture of the pages that a command makes: the commands, and the pages filled with what they wrote.

    python docs/figures.py                      # all that need no training; an hour on 2 cores
    python docs/figures.py reproduce tables     # some of MAKERS
    python docs/figures.py --fill               # run nothing: the pages anew from what is there in out/figures

A command writes tables as NAME.md, and pictures, into out/figures/MAKER. A page shows them between markers,
`<!-- begin MAKER/NAME -->` and `<!-- end MAKER/NAME -->`, and as `images/MAKER/NAME.png`. Makers that train policies
take hours and run when they are named; what they have trained they take again.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from wsn_env.evaluation.files import replacing
from wsn_env.reports.markdown import block_names, fill_blocks

HERE = Path(__file__).parent
ROOT = HERE.parent
OUT = ROOT / "out" / "figures"
IMAGES = HERE / "images"
RUNS = "out/figures/runs"
TRACKS = sorted(map(str, (ROOT / "out" / "tracks").glob("*.csv")))  # as examples/ble_tracks.py makes them
RECORDED = ["--tracks", *TRACKS] if TRACKS else []  # without them tables lack the row of recorded motion
SHIPPED = ("PreDC-v0", "Rssi-v0", "Binary-v0", "Anchors-v0", "Underwater-v0")  # whose policy is compared in many worlds
FAULTS = [  # that a policy is trained with, beside those of none in fewer and in more nodes
    *("nodes=75", "nodes=450", "faults=failures,share=0.3", "faults=regional_failure,region_m=25"),
    *("faults=stuck,share=0.1", "faults=biased,bias_m=5", "faults=misplaced,position_sd_m=1"),
    *("faults=false_alarms,probability=0.05", "faults=missed,probability=0.2", "faults=bursts,to_bad=0.05"),
    *("faults=late,probability=0.2", "faults=stops,stop_s=20", "faults=excursion,outside_m=10"),
]


MAKERS: dict[str, list[list[str]]] = {  # arguments of Python, one command after the other; {out}: its folder
    "reproduce": [["-m", "wsn_env", "reproduce", "all", "--out", "{out}"]],
    "reference": [["docs/reference_tables.py", "--out", "{out}"]],
    "tables": [["-m", "studies.tables", "--out", "{out}"]],
    "bound": [["-m", "studies.bound", "--out", "{out}"]],
    "leaderboard": [["-m", "studies.leaderboard", "--out", "{out}"]],
    "particles": [["-m", "studies.particles", "--out", "{out}"]],
    "lifetime": [["-m", "studies.lifetime", "--out", "{out}"]],
    "multi": [["-m", "studies.targets", "--out", "{out}"]],
    "association": [["-m", "studies.association", "--out", "{out}"]],
    "worlds": [["-m", "studies.worlds", "--scenario", name, *RECORDED, "--out", "{out}"] for name in SHIPPED],
    "reliability": [["-m", "studies.reliability", "--out", "{out}"]],
    "planning": [
        ["-m", "studies.planning", "--scenario", name, "--out", "{out}/" + name] for name in ("PreDC-v0", "Rssi-v0")
    ],
}
TRAINING_MAKERS: dict[str, list[list[str]]] = {
    "faults": [
        *(
            [*"train.py --resume --scenario PreDC-v0 --episodes 0 --runs".split(), RUNS, *more, "--vary", *FAULTS]
            for more in (["--name", "ppo_faults"], ["--name", "ppo_faults_error", "--reward", "error"])
        ),
        ["-m", "studies.faults", "--trained", f"{RUNS}/ppo_faults", f"{RUNS}/ppo_faults_error", "--out", "{out}"],
    ],
}
ALL = MAKERS | TRAINING_MAKERS


def pages() -> list[Path]:
    """All that may have blocks."""
    return [ROOT / "README.md", *sorted(HERE.rglob("*.md"))]


def make(name: str) -> None:
    """Run its commands; what they wrote before is gone, but for what a training goes on from."""
    folder = OUT / name
    if name in MAKERS:
        shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    for command in ALL[name]:
        subprocess.run([sys.executable, *(part.format(out=folder) for part in command)], cwd=ROOT, check=True)
    print(f"{name}: {time.perf_counter() - start:.0f} s", flush=True)


def fill(made: Sequence[str], out: Path = OUT) -> list[Path]:
    """Fill every page from the folders of these makers, and renew its pictures. Returns the pages changed.

    Raises:
        ValueError: if a page names a table that its command did not write.
    """
    changed = []
    for page in pages():
        old = page.read_text(encoding="utf-8")
        blocks = {}
        for block in block_names(old):
            if block.partition("/")[0] in made:
                table = out / f"{block}.md"
                if not table.exists():
                    raise ValueError(f"{page.relative_to(ROOT)}: block {block!r}: {table} was not written")
                blocks[block] = table.read_text(encoding="utf-8")
        new = fill_blocks(old, blocks)
        if new != old:
            with replacing(page) as temporary:
                temporary.write_text(new, encoding="utf-8")
            changed.append(page)
        for picture in re.findall(r"images/([\w./-]+\.png)\)", new):
            if picture.partition("/")[0] in made:
                (IMAGES / picture).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(out / picture, IMAGES / picture)
    return changed


def main() -> None:
    """Run commands, fill pages."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(ALL)}; left out: the first {len(MAKERS)}")
    parser.add_argument("--fill", action="store_true", help="run nothing")
    asked = parser.parse_args()
    unknown = [name for name in asked.names if name not in ALL]
    if unknown:
        parser.error(f"names = {unknown}: unknown; allowed are {', '.join(ALL)}")
    made = asked.names or [name for name in (ALL if asked.fill else MAKERS) if not asked.fill or (OUT / name).is_dir()]
    for name in [] if asked.fill else made:
        make(name)
    for page in fill(made):
        print(f"renewed: {page.relative_to(ROOT)}")


if __name__ == "__main__":
    main()

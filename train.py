"""Train one PPO scheduler for every trade-off, then compare it with every baseline: `wsn train`.

    python train.py --scenario PreDC-v0

The work is in wsn_env/training/trainer.py, which reads top to bottom.
"""

import sys

from wsn_env import cli


def main(arguments: list[str] | None = None) -> int:
    """`wsn train` with these options; None: the command line's."""
    return cli.main(["train", *(sys.argv[1:] if arguments is None else arguments)], prog="train.py")


if __name__ == "__main__":
    sys.exit(main())

"""Published systems rebuilt: for each its tables, figures and claims beside ours. `reproduce` finds them by name."""

from wsn_env.papers.reproduction import PAPERS, reproduce

__all__ = ["PAPERS", "reproduce"]

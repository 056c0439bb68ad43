"""What of Zhou, Cheng & Xing (2009) is rebuilt, and where."""

from wsn_env.papers.coverage import Item

COVERAGE: tuple[Item, ...] = ()

"""Pre-DC: prediction-based dynamic clustering (Xiang & Guo, 2013), its Table 2 and Figs. 1 and 3-8 beside ours."""

from wsn_env.papers.pre_dc.rebuild import reproduce, same_tracker, table2

__all__ = ["reproduce", "same_tracker", "table2"]

"""Pre-DC: prediction-based dynamic clustering (Xiang & Guo, 2013), its Table 2 and Figs. 1-8 beside ours."""

from wsn_env.papers.pre_dc.rebuild import reproduce

__all__ = ["reproduce"]

"""Field, motion, sensing and radio: short compiled pieces over one row; they know arrays and constants only."""

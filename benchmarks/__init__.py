"""Claims about speed, one a file, each with the contestants that it needs."""

"""Claims about speed, one a file, each with the implementations that it needs."""

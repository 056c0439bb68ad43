"""Policies: hand-written ones, a file each, and the learned ones. They see only the View."""

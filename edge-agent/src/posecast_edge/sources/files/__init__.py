"""Recordings: CSV, MCAP and trajectory files, played at the pace of their own clock."""

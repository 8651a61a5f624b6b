"""Reads the settings of a relay; reads, follows and edits the file of robots."""

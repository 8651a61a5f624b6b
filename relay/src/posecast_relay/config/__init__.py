"""Reads the settings of a relay; reads, watches and edits the robots file."""

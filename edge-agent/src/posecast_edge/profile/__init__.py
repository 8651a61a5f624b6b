"""Everything specific to one robot: its fields, joints, views and topics, read from TOML."""

"""The past over HTTP: routes and responses."""

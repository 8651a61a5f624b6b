"""Settings of a relay, and the file of robots: read, followed and edited."""

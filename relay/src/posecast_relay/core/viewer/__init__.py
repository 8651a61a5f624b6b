"""One viewer: when it is due by its rate, and the messages it gets."""

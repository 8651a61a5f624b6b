"""One viewer, when its rate makes it due, and the messages it is sent."""

"""The agent's single outbound connection: publishes frames and events, answers queries, measures lateness."""

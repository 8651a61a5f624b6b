"""Runs one relay process: opens its listener and the services of its role, serves, and closes everything."""

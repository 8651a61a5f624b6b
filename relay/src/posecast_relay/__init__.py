"""The relay: latest state in, thousands of viewers out."""

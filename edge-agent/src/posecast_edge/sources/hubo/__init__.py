"""Hubo 2+ and DRC-Hubo: the ACH channel `hubo-state`, from shared memory or through achd."""

"""Errors, messages, records, configuration and the descriptions of laws: what every other room builds on."""

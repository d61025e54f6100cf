"""The driver: plans run by engines, in memory or block by block, and what is made of light fields that way."""

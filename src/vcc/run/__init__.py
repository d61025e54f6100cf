"""The driver: engines run plans, in memory or block by block; exposure, demosaicing and linear operators."""

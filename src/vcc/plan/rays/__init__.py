"""Images by rays: a plan of the rays to trace from each pixel, as plain data, and its compiler."""

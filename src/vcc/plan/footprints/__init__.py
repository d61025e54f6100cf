"""Images by footprints: a plan of the light that each sample adds to each pixel, and its compiler."""

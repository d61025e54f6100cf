"""The optical bench: a camera on its axis beside the picture that it makes, both moving together."""

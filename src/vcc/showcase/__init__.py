"""What the demo and the gallery show with: a built-in scene, a bench, figures and pages."""

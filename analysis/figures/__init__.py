"""From data to axes: colours, canvases and every figure."""

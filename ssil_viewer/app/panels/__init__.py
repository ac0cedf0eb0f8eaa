"""What is drawn over the image, one file per panel. Panels read the state and call actions; none calls OpenGL."""

"""moderngl without effects: contexts, shaders, uniform blocks, render targets, timers, scene upload."""

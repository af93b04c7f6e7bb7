"""Use-cases: what a user asks for, done with the domain and, where Blender is needed, through a port."""

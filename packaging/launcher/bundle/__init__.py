"""The bundled build: libraries as static archives, one native module for several Pythons, wheel and zips."""

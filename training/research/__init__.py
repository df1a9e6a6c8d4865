"""Research: `fourier_wiring`, Fourier cells wired as a string of given modes."""

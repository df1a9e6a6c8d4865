"""Scripts that nothing imports: `fourier_wiring` trains Fourier cells that are wired as a string of given modes."""

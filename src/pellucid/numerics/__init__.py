"""What happens to samples between a recording and a model: zero-phase filters, derivatives, resampling, effort."""

"""Success and failure: a Gaussian process behind a probit likelihood."""

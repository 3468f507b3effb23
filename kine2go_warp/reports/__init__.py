"""One page that shows a dataset: scores, plots, pictures, where it comes from."""

"""Fig. 7: the forgetting factor and the initial covariance."""

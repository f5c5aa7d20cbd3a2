"""Sample test efficiency: Fatahalian et al. 2009, Eisenacher & Loop 2010, Yao et al. 2012."""

"""Rows B1 to B9: the flexible torsion system of Myklebust (Linköping University 2009)."""

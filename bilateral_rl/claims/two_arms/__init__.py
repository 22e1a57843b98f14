"""The claims B1 to B6 on two arms that one brain controls, each computed from the results of a study."""

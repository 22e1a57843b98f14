"""The arm without its muscles: what two links do, from textbook mechanics."""

import numpy as np

LINK, CENTER, MASS, INERTIA = (0.309, 0.333), (0.135, 0.165), (1.82, 1.43), (0.051, 0.057)


def mass_matrix(elbow):
    """(n, 2, 2) of the two links, from the positions of their centers of mass."""
    second = INERTIA[1] + MASS[1] * CENTER[1] ** 2
    coupling = MASS[1] * LINK[0] * CENTER[1] * np.cos(elbow)
    first = INERTIA[0] + MASS[0] * CENTER[0] ** 2 + MASS[1] * LINK[0] ** 2 + second + 2 * coupling
    return np.moveaxis(np.array([[first, second + coupling], [second + coupling, np.full_like(elbow, second)]]), -1, 0)


def kinetic_energy(joint):
    """(n,) of joint states (n, 4) (J)."""
    return 0.5 * np.einsum("ni,nij,nj->n", joint[:, 2:], mass_matrix(joint[:, 1]), joint[:, 2:])


def jacobian(angles):
    """(n, 2, 2) of the hand position with respect to the joint angles."""
    shoulder, both = angles[:, 0], angles.sum(axis=1)
    fore = LINK[1] * np.array([-np.sin(both), np.cos(both)])
    upper = LINK[0] * np.array([-np.sin(shoulder), np.cos(shoulder)])
    return np.moveaxis(np.array([upper + fore, fore]), -1, 0).swapaxes(1, 2)

"""Names of the paper's released code in TensorFlow, of which the reference numbers are."""


def released_name(name):
    """The released code's name of our parameter ``name``, but for what stands before it. Its left is our dominant."""
    combination = {"combination_dominant": "wtAdd_w1", "combination_non_dominant": "wtAdd_w2"}
    if name in combination:
        return combination[name]
    *module, kind = name.split(".")
    layers = {
        "output": "output_layer",
        "hidden": f"hidden_layer_{module[-1]}",
        "dominant": f"hidden_l_{module[-1]}",
        "non_dominant": f"hidden_r_{module[-1]}",
    }
    return f"{layers[module[0]]}/{'kernel' if kind == 'weight' else 'bias'}"

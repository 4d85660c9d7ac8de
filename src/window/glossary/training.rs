use super::term::terms;

terms! { NETWORK_TERMS:
    HIDDEN_NODES = "Hidden nodes",
        "Number of nodes in the tanh layer between resistances and coordinates.",
        "coordinates = V · tanh(W · inputs + b) + c";
    INPUTS = "Inputs",
        "Quantity that the network reads for each resistance.";
    CONDUCTANCE = "Conductance",
        "1/R. By Eq. (2) it is a sum over nodes, and so the closest to linear in the deformation.";
    LOG_RESISTANCE = "Log-resistance",
        "ln R: relative errors become additive.";
    SCALING = "Scaling",
        "Scaling of the inputs.";
    MIN_MAX = "Min-max",
        "Each channel scaled to −1 to 1, as in the paper.",
        "2 · (x − min) / (max − min) − 1";
    WHITENING = "Whitening",
        "Principal components, each divided by its scatter: components of small variance count as much as large ones, \
         unless noise hides them.",
        "component / √(σ² + noise²)";
    STARTS = "Starts",
        "Number of trainings from different random weights, side by side; the one with the lowest validation error is \
         kept. Several starts show how much the results vary.";
    SEED = "Seed",
        "Seed of all random numbers: the same seed gives the same network.";
}

terms! { TRAINING_TERMS:
    METHOD = "Method",
        "Algorithm that adjusts the weights.";
    EPOCH = "Epoch",
        "One pass over the training set, after which the weights change.";
    MSE = "mse",
        "Mean square error of the scaled coordinates, each in [−1, 1]; those that are constant are left out.",
        "mse = mean (decoupled − actual)²";
    TRAINING_SET = "Training set",
        "The samples to which the network is fitted.";
    VALIDATION_SET = "Validation set",
        "Samples that select the best weights and end the training; 0 for none, and all epochs are run.";
    TEST_SET = "Test set",
        "Held-out samples, on which all errors are measured and whose snapshots are shown. They are never trained on.";
    VALIDATION_FAILURES = "Validation failures",
        "Training ends after this many epochs without a new best validation error.";
    GRADIENT = "Gradient",
        "Derivative of the training error by the weights; its norm falls towards 0 at a minimum.",
        "∂ mse / ∂ weights";
    DAMPING = "Damping μ",
        "Shortens the steps of Levenberg-Marquardt: large, they follow the gradient; small, they are Gauss-Newton steps.",
        "(J^T J + μ I) · step = −J^T · error";
    EFFECTIVE_PARAMETERS = "Effective parameters",
        "Number of weights that the data determine, as estimated by Bayesian regularisation. Near the number of weights, \
         more hidden nodes may help; far below it, fewer would do.",
        "γ = N − α tr (β J^T J + α I)⁻¹";
}

# %% [markdown]
# # From a sensor array to a network on the robot
#
# A tactile array is simulated, a network is trained to decode its readings, and the network is exported to ONNX.
# Needs `matplotlib` and `onnxruntime`.

# %%
import os
import tempfile
from pathlib import Path

import matplotlib

if not os.environ.get("DISPLAY") and "inline" not in matplotlib.get_backend():
    matplotlib.use("agg")

import matplotlib.pyplot as plt
import numpy as np
import onnxruntime
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_score

from decoupler import NetworkRegressor, RidgeDecoder, SensorArray, errors, simulate

# %% [markdown]
# ## Samples
# One sample is one row-wire at one moment: 18 resistances in ohm, and the coordinates of the row-wire's 6 nodes in mm.

# %%
sensor = SensorArray("10x6_3x18")
data = simulate(sensor, samples=600, test_samples=100, seed=1)
print("training samples", data.train.X.shape, "targets", data.train.y.shape)
print("condition number of a row-wire", round(sensor.identifiability(row=4).condition))

# %% [markdown]
# ## Training

# %%
model = NetworkRegressor(hidden=12, epochs=200, inputs="resistance", random_state=1)
model.fit(data.train.X, data.train.y, validation=data.validation)
answers = model.predict(data.test.X)
found = errors(data.test.y, answers, stroke_mm=data.stroke_mm)
ridge = RidgeDecoder(inputs="resistance").fit(data.train.X, data.train.y)
of_ridge = errors(data.test.y, ridge.predict(data.test.X), stroke_mm=data.stroke_mm)
print(f"{model.n_iter_} epochs: {model.stop_reason_}")
print(f"AveZerr {found.z_percent:.2f} % ({found.z_mm:.4f} mm), ridge {of_ridge.z_percent:.2f} %")

figure, axes = plt.subplots()
axes.semilogy(model.loss_curve_, label="training")
axes.semilogy(model.validation_loss_curve_, label="validation")
axes.set(xlabel="epoch", ylabel="mean squared error (scaled)")
axes.legend()

# %% [markdown]
# ## Surfaces
# The actual and the decoded surface of the first test snapshot.

# %%
first = data.test.groups == data.test.groups[0]
surfaces = {"actual": data.test.y[first], "decoded": answers[first]}
figure, axes = plt.subplots(1, 2, subplot_kw={"projection": "3d"}, figsize=(9, 4))
for plot, (title, coordinates) in zip(axes, surfaces.items(), strict=True):
    x, y, z = np.moveaxis(coordinates.reshape(sensor.row_wires, sensor.nodes_per_row, 3), -1, 0)
    plot.plot_surface(x, y, z, cmap="viridis")
    plot.set(title=title, xlabel="x (mm)", ylabel="y (mm)", zlabel="z (mm)")

# %% [markdown]
# ## Cross-validation and the number of hidden nodes
# Samples of one snapshot share a deformation, so folds keep them together.

# %%
quick = NetworkRegressor(hidden=8, epochs=40, inputs="resistance", random_state=1)
folds = list(GroupKFold(3).split(data.train.X, groups=data.train.groups))
scores = cross_val_score(quick, data.train.X, data.train.y, cv=folds)
print("R2 in each fold", np.round(scores, 3))

search = GridSearchCV(quick, {"hidden": [4, 8, 16]}, cv=folds)
search.fit(data.train.X, data.train.y)
print("best number of hidden nodes", search.best_params_["hidden"])

# %% [markdown]
# ## Export
# The files state how far answers of other programs may deviate from those of the network.

# %%
with tempfile.TemporaryDirectory() as folder:
    exported = model.export(Path(folder) / "decoder", format="onnx")
    graph = next((Path(folder) / "decoder").glob("*.onnx"))
    session = onnxruntime.InferenceSession(str(graph))
name = session.get_inputs()[0].name
from_onnx, readings_outside = session.run(None, {name: data.test.X})
print(f"largest difference {np.abs(from_onnx - answers).max():.1e} mm")
assert np.allclose(from_onnx, answers, rtol=0.0, atol=1e-9)

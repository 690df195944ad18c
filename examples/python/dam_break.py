# %% A dam break in the plane: python dam_break.py MODEL [PICTURE]; cell by cell in an editor that knows `# %%`.
import sys
import ascc, matplotlib.pyplot as plt

# %% A column of water in the corner of a tank.
model = ascc.Model(sys.argv[1])
water = ascc.Particles(model)
water.add_fluid(ascc.block((0.5 * water.spacing,) * 2, (24, 48), water.spacing))
water.add_boundary(*ascc.box((0, 0), (1.6, 0.9), water.spacing))
step = ascc.Step(model)

# %% Four moments of it, coloured by speed.
figure, axes = plt.subplots(2, 2, figsize=(10, 6), layout="constrained")
for i, panel in enumerate(axes.flat):
    step.run(water, 60 if i else 0)
    dots = panel.scatter(*water.position.T, s=4, c=(water.velocity**2).sum(1) ** 0.5, vmin=0, vmax=3)
    panel.set(title=f"{60 * i * model.info.time_step:.1f} s", xlim=(0, 1.6), ylim=(0, 0.9), aspect="equal")
figure.colorbar(dots, ax=axes, label="m/s")
figure.savefig(sys.argv[2]) if len(sys.argv) > 2 else plt.show()

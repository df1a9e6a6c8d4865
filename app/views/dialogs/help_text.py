"""What the help dialog says beside the list of keys and of views."""

from __future__ import annotations

TOUR = (
    (
        "Pluck",
        "Drag on the string and let go. The white handle is where, and how far, it is pulled. You hear the model.",
    ),
    (
        "Compare",
        "Press X: now you hear the truth, the solved physics, at the same playhead and level. Press X again. The "
        "small arrows beside A and B choose what they hold: the difference made louder, or another preset.",
    ),
    (
        "Look",
        "Amber is the model, blue the truth, in every view. The picture is slowed like under a stroboscope, the "
        "sound is not: the motion knob sets how much.",
    ),
    (
        "Go past the training",
        "In the waveform, everything behind the red line is longer than any motion the model was shown. Choose "
        "another preset with Page down and hear which of them drift there.",
    ),
    (
        "Look closer",
        "Choose Space–time or Error over time: a click moves the playhead there. In Eigenvalues and Partials a click "
        "lets you hear one mode alone once it plays, Esc all of them; in the Error map it plucks there.",
    ),
    (
        "Listen elsewhere",
        "Drag the green marker beneath the string. Near a node of a partial, that partial is gone; at the ends there "
        "is silence. Stereo gives you two such points; Velocity listens as a magnetic pick-up does.",
    ),
    (
        "Leave what it knows",
        "The hatched parts of the string are where the model was never plucked. You may pluck there; the window "
        "says so.",
    ),
    (
        "Choose and judge",
        "Ctrl+P browses the presets, the truest first, and a preset file dropped on the window becomes one of yours. "
        "Ctrl+T is a blind test: can you tell model and truth apart?",
    ),
    ("Keep it", "Ctrl+E saves WAVs that carry their recipe. Drop one on the window, and the sound is back."),
)

GESTURES = (
    ("Click on the string", "pluck there, as far as the last time"),
    ("Drag on the string", "pluck there, that far"),
    ("Drag the green marker", "move the listening point; double-click resets it"),
    ("Arrow keys on the string", "move the pluck; with Shift the listening point"),
    ("Drag, wheel or arrow keys on a knob", "change it; with Shift finely"),
    ("Digits on a knob", "type a value, then Enter"),
    ("Delete or double-click on a knob", "its default"),
    ("Click in the waveform", "move the playhead; the wheel zooms, double-click shows all"),
)

MODELS = (
    (
        "DMD",
        "Dynamic mode decomposition: the one linear map that carries each frame, together with its predecessors, "
        "closest to the next, found by least squares and not trained. Its eigenvalues are fixed frequencies and "
        "decays, so it suits a linear string; it cannot follow partials that fall in pitch.",
    ),
    (
        "Koopman",
        "A neural network maps the initial shape to a latent state in which time is linear: each latent turns and "
        "decays at its own fixed eigenvalue. A second network maps the latents back to the string, and all "
        "nonlinearity must lie in these two maps.",
    ),
    (
        "Koopman_var",
        "The paper's variant: encoder and decoder are linear, and a network multiplies the latents by a factor "
        "that depends on their present energies. It bends amplitude and phase within the motion it was trained "
        "on; a pitch that glides needs an accumulated phase, which the present energies alone do not hold.",
    ),
    (
        "Integrated phase",
        "Koopman with eigenvalues that follow the decaying energies of the modes and are integrated over time, "
        "as the tension of a real string makes its partials glide. The gain is bounded and every latent decays "
        "for any weights, and a quiet string is the linear one. Any moment can be computed directly, at any "
        "sample rate.",
    ),
    (
        "Shared tension",
        "One model for every string. Each latent is a mode of the linear string; many times a period, the "
        "tension that all of them add turns them together. Three learned curves mend what such steps get wrong, "
        "the same for all modes of all strings: pitch, stiffness, damping and tension are inputs. Bounded and "
        "decaying for any weights, at any sample rate.",
    ),
    (
        "LRU",
        "Linear recurrent unit: layers of a diagonal linear recurrence that is stable for every weight, with "
        "networks that bend each sample between them. The initial shape goes in as one impulse; from then on the "
        "layers ring, and the string is read off sample by sample.",
    ),
    (
        "S5",
        "Structured state space: like the LRU a stack of diagonal recurrences with nonlinear layers between, but "
        "discretised from continuous time with a learned step. Its decay is not bounded by construction, so a "
        "trained model may grow; playback is limited, and a runaway is silenced and told.",
    ),
    (
        "FGRU",
        "A gated recurrent cell whose state is a field along the string. Its gates are Fourier convolutions, "
        "which mix low spatial frequencies over the whole length; the gates decide how much of the field is kept "
        "at every step.",
    ),
    (
        "FRNN",
        "The same Fourier convolutions in a plain recurrent cell without gates, several layers a step. Each step "
        "adds a map of every point to the convolution; small errors feed on through the recurrence.",
    ),
)

CITATION = (
    "R. Diaz, C. De La Vega Martin and M. Sandler, “Towards Efficient Modelling of String Dynamics: A Comparison "
    "of State Space and Koopman based Deep Learning Methods”, Proceedings of the 27th International Conference "
    "on Digital Audio Effects (DAFx24), 2024."
)

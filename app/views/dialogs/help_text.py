"""What the help dialog says beside the list of keys and of views."""

from __future__ import annotations

TOUR = (
    (
        "Play",
        "Press A S D F … as on a piano, black keys above, or click the keys at the bottom. Hold a key and the string "
        "rings, release to damp it. Z and X change the octave. You hear the model.",
    ),
    (
        "Choose an instrument",
        "The list at the bottom left has guitars, harps, harpsichords and others. String knobs shows every knob "
        "in place of the macros: tension, length, material, damping and pluck. Record saves what you play; a MIDI "
        "file that is opened or dropped is played. In the same strip you choose whether the computer's keys play "
        "notes or set the pluck position.",
    ),
    (
        "Pluck",
        "Drag on the string in the picture and release. The white handle shows the pluck's position and amplitude.",
    ),
    (
        "Compare",
        "Press F9 for the Lab, and B to hear the truth, the numerical solution of the string's equation, at the same "
        "playhead and level. B again returns. The small arrows beside A and B select their sources: model, truth, "
        "the amplified difference, or another preset.",
    ),
    (
        "Look",
        "Amber is the model, blue the truth, in every view. The string is shown in slow motion, as under a "
        "stroboscope; the sound is not slowed. The slow-mo knob sets the factor.",
    ),
    (
        "Go past the training",
        "In the waveform, the red line marks the end of the training data; after it the model extrapolates. "
        "Step through the presets with Page down to hear which of them drift there.",
    ),
    (
        "Look closer",
        "Choose Space–time or Error over time: a click moves the playhead there. In Eigenvalues and Partials a click "
        "solos one mode, Esc plays all of them; in the Error map a click plucks there.",
    ),
    (
        "Listen elsewhere",
        "Drag the green marker beneath the string. At a node of a partial, that partial is not heard; at the ends "
        "nothing is. Stereo has two listening points; Magnetic is a magnetic pick-up. While keys play "
        "the instrument, all three belong to it, and what you hear is saved, recorded and exported.",
    ),
    (
        "Beyond the training range",
        "The hatched parts of the string were not plucked in the model's training. You can pluck there: the model "
        "extrapolates, and the window says so.",
    ),
    (
        "Browse and test",
        "Ctrl+P browses the presets, the most accurate sound first; a preset file dropped on the window is "
        "added to your own. Ctrl+T is a blind test: can you tell model and truth apart?",
    ),
    (
        "Export",
        "Ctrl+E saves what you hear as WAV: a note with body, room and level, its string alone, or a recording. "
        "A note's file stores its settings; drop it on the window to restore them. Ctrl+Shift+E exports the "
        "instrument for samplers.",
    ),
)

GESTURES = (
    ("Click on the string", "pluck there, with the last amplitude"),
    ("Drag on the string", "pluck there, with that amplitude"),
    ("Drag the green marker", "move the listening point; double-click resets it"),
    ("Arrow keys on the string", "move the pluck; with Shift the listening point"),
    ("Drag, wheel or arrow keys on a knob", "change it; with Shift in fine steps"),
    ("Tab, then Enter", "press the button, or open the list, that Tab went to; else Enter plucks"),
    ("Digits on a knob", "type a value, then Enter"),
    ("Delete or double-click on a knob", "reset to the default"),
    ("Click in the waveform", "move the playhead; the wheel zooms, double-click shows all"),
)

MODELS = (
    (
        "DMD",
        "Dynamic mode decomposition: the linear map from each frame and its predecessors to the next, "
        "fitted by least squares. Its eigenvalues are fixed frequencies and "
        "decays, so it suits a linear string; it cannot follow partials that fall in pitch.",
    ),
    (
        "Koopman",
        "A neural network maps the initial shape to a latent state in which time is linear: each latent rotates and "
        "decays at its own fixed eigenvalue. A second network maps the latents back to the string, and all "
        "nonlinearity is in these two maps.",
    ),
    (
        "Koopman, variable",
        "The paper's Koopman_var: encoder and decoder are linear, and a network multiplies the latents by a factor "
        "that depends on their present energies. It bends amplitude and phase within the motion it was trained "
        "on; a pitch that glides needs an accumulated phase, which the present energies alone do not hold.",
    ),
    (
        "Koopman, integrated phase",
        "Koopman with eigenvalues that follow the decaying energies of the modes and are integrated over time, "
        "as the tension of a real string makes its partials glide. The gain is bounded and every latent decays "
        "for any weights, and a quiet string is the linear one. Any moment can be computed directly, at any "
        "sample rate.",
    ),
    (
        "Koopman, shared tension",
        "One model for every string. Each latent is a mode of the linear string; many times a period, the "
        "phases of all are advanced by the tension that all of them add. Three learned curves, the same for all "
        "modes of all strings, correct the error of such steps: pitch, stiffness, damping and tension are inputs. "
        "Bounded and "
        "decaying for any weights, at any sample rate.",
    ),
    (
        "LRU",
        "Linear recurrent unit: layers of a diagonal linear recurrence that is stable for every weight, with "
        "nonlinear networks between them. The initial shape is the input of the first sample, an impulse; from then "
        "on the layers resonate, and each sample is decoded to the displacement of the string.",
    ),
    (
        "S5",
        "Structured state space: like the LRU a stack of diagonal recurrences with nonlinear layers between, but "
        "discretised from continuous time with a learned step. Its decay is not bounded by construction, so a "
        "trained model may grow; playback is limited, and an unbounded output is muted with a notice.",
    ),
    (
        "Fourier GRU",
        "FGRU: a gated recurrent cell whose state is a field along the string. Its gates are Fourier convolutions, "
        "which mix low spatial frequencies over the whole length; the gates decide how much of the field is kept "
        "at every step.",
    ),
    (
        "Fourier RNN",
        "FRNN: the same Fourier convolutions in a plain recurrent cell without gates, several layers a step. Each "
        "step adds a map of every point to the convolution; small errors feed back through the recurrence and may "
        "leave a soft hum, some 60 dB below full scale, after the string has died away.",
    ),
)

ERRORS = (
    "A dialog shows an unexpected error; its text can be copied into a bug report. The program continues where "
    "it can; your settings are kept.",
    "The same text is in the log, with the version and the system. If the program crashed, a file beside the log "
    "that ends in .crash says where each thread was. Please send both. The log is here:",
)

CITATION = (
    "R. Diaz, C. De La Vega Martin and M. Sandler, “Towards Efficient Modelling of String Dynamics: A Comparison "
    "of State Space and Koopman based Deep Learning Methods”, Proceedings of the 27th International Conference "
    "on Digital Audio Effects (DAFx24), 2024."
)

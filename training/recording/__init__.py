"""The way from a recording of one plucked note to its string: gate, partials, poles, physics, preset, report.

    samples ─► Note (note) ─► reasons (gate) ─► Series (numbering) ─► Glide (glide)
            ─► LearnedNote (fit: refine, sweeps) ─► string and preset (physics, preset)
            ─► errors (report) ─► string found or not (verdict)

A note is a sum of decaying partials that share one glide of pitch, and of a few poles that do not glide:

    y(t) = Re Σ_k a_k exp(s_k τ(t)) + Re Σ_j b_j exp(p_j t),      dτ/dt = 1 + Σ_i c_i exp(-t/T_i).

τ is the time in which the string's eigenvalues are constant: it runs faster while the tension is raised.
"""

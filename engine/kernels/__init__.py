"""The compiled code that makes sound: voices, and the mixer that a sound device calls without the interpreter.

    memory     pointers, fences, and what is published to another thread
    strings, recorded, rotation, pulses, velocities
               laws of physics: plain functions, which Python calls as they are
    midi       numbers of controllers
    records    what is played; voice_records, mixer_records: what sounds
    bank       a voice of complex exponentials whose phases follow their energies: models with a linear decoder
    tension    a voice of latents that share one tension: the model of every string; lanes: its inner loops
    truth      a voice of the solved string
    rendered   a voice that reads samples which somebody else renders
    voice      what all voices share: listening points, pick-up, gain, silence; courses: alone or on one bridge
    fourier    a transform without memory of its own
    convolver  the sum of all voices through an impulse response: body and room
    sympathy   strings that ring with those that are played
    limiter    the safety limiter, which looks ahead
    mixer      the sum of all voices, effects, volume, limiter, meters; the device's callback
    cache      where they are kept once they are compiled

A voice and a mixer are NumPy records; `engine.voices` makes their memory. The interpreter may be
busy with anything: nothing here waits for it.
"""

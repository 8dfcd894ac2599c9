"""The hidden-effect test: diagnoses of campaigns whose truth is sealed, judged when all of them are there.

Beside the generator and not in it, since the generator shares no code with the program and this runs the program;
among the benchmarks, since it takes hours and its result is a table. Only ``program`` and ``choosing`` know what a
diagnosis is made of; ``judgement`` knows truths and answers as plain data.
"""

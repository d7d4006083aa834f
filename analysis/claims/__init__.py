"""The paper's claims held against results: points, verdicts, sentences, small pictures."""

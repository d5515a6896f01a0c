"""The paper's four networks in torch: windows, modules, training through skorch, fitted networks.

The only folder of the package that imports torch and skorch; others import it when a network is asked for.
"""

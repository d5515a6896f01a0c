"""The paper's four networks; only this folder imports torch and skorch, and others import it when they need one."""

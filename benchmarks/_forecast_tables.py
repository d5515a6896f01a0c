def write_results(store): return []

"""Results and light fields as one HTML page, and a server for refocusing live."""

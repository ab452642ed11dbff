"""What only the thesis needs: its statements, judged on runs."""

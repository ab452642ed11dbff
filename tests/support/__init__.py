"""What tests share: cases, loops, grammars, rigs and files of laws."""

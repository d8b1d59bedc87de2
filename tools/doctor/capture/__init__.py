"""What a capture says of the sessions in it: one verdict, the evidence below it."""

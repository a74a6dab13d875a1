"""Known changes of a weighed rig, as recorded by a real STS3215: which of them a diagnosis names, and what size it gives them."""

"""The thesis's own riddles: what would a recording look like under each explanation, and which measurement decides?"""

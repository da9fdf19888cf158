"""What an orthosis and the limb inside it do to each other: each alone, then the strap between them."""
